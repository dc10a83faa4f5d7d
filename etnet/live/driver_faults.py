"""What a camera's driver complains of, as one sentence that says what to do.

The driver tells its errors as text; the words looked for are libusb's and its own.
"""

from __future__ import annotations

from typing import Literal

Fault = Literal["absent", "busy", "forbidden", "unplugged", "other"]

_SIGNS: tuple[tuple[Fault, tuple[str, ...]], ...] = (
    ("busy", ("already used by another program", "busy")),
    ("forbidden", ("access denied", "access error", "could not access", "permission", "insufficient")),
    ("unplugged", ("no such device", "disconnected", "no_device", "nodevice")),
    ("absent", ("no device found", "not found", "there is no device", "no lucid triton")),
)


def fault_of(message: str) -> Fault:
    """The kind of fault that a driver's error text tells."""
    said = message.lower()
    for kind, signs in _SIGNS:
        if any(sign in said for sign in signs):
            return kind
    return "other"


def sentence(name: str, message: str) -> str:
    """What is wrong with the camera `name`, and what to do."""
    match fault_of(message):
        case "busy":
            return f"{name}: another program uses the camera; close DV, Metavision Studio, jAER or the other viewer"
        case "forbidden":
            return (
                f"{name}: no right to use the USB device; run `sudo $(which neuromorphic-drivers-install-udev-rules)` "
                "once, then plug the camera in again"
            )
        case "unplugged":
            return f"{name}: the camera was unplugged; plug it in again, it goes on by itself"
        case "absent":
            return f"{name}: no such camera is plugged in; look at the cable, `ndls` lists what the driver sees"
        case "other":
            return f"{name}: the driver gives up ({message.strip() or 'no reason given'})"
