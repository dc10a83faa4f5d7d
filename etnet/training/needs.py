"""What training needs of others' packages. `python -m etnet.training.needs` says in one line what is missing here."""

from __future__ import annotations

import sys
from importlib import import_module

OLDEST_PYTHON = (3, 11)
NEEDS = {
    "torch": "torch>=2.6",
    "numpy": "numpy>=2.0",
    "cv2": "opencv-python-headless>=4.10",
    "safetensors": "safetensors>=0.5",
    "jaxtyping": "jaxtyping>=0.3",
    "einops": "einops>=0.8",
    "tyro": "tyro>=1.0",
    "rich": "rich>=13",
}
"""Module → what to install for it."""


def missing() -> list[str]:
    """What cannot be imported here, and why."""
    found = []
    for module, package in NEEDS.items():
        try:
            import_module(module)
        except ImportError as error:
            found.append(f"{package} ({' '.join(str(error).split())})")
    return found


def main() -> int:
    """Print what is at hand, or what is not; the exit code says whether everything is."""
    version = ".".join(map(str, sys.version_info[:3]))
    if sys.version_info[:2] < OLDEST_PYTHON:
        oldest = ".".join(map(str, OLDEST_PYTHON))
        print(f"etnet: this is Python {version}; wanted {oldest} or newer (PYTHON=… names another)", file=sys.stderr)
        return 1
    if lacking := missing():
        print(f"etnet: missing here: {', '.join(lacking)}; put them where PYTHONPATH leads", file=sys.stderr)
        return 1
    torch = import_module("torch")
    device = torch.cuda.get_device_name() if torch.cuda.is_available() else "no GPU"
    print(f"Python {version}, torch {torch.__version__}, {device}", file=sys.stderr)
    return 0


if __name__ == "__main__":
    sys.exit(main())
