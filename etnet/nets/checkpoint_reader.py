"""Read a pickled torch checkpoint without running anything in it, and without torch's own loader.

Released checkpoints pickle more than tensors (a `parse_config.ConfigParser` full of paths, optimisers, loggers).
Tensors and plain containers are rebuilt; every other class becomes an inert `Foreign` that only remembers its name
and state. No code of the file's choosing is ever imported or called, and no tensor can be larger than the file.
"""

from __future__ import annotations

import io
import math
import pickle
import zipfile
from collections import OrderedDict
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NoReturn

import torch
from torch import Tensor

from etnet.errors import WeightsError
from etnet.nets.containers import Container, container_of

_ITEM_TYPES: dict[str, torch.dtype] = {
    "DoubleStorage": torch.float64,
    "FloatStorage": torch.float32,
    "HalfStorage": torch.float16,
    "BFloat16Storage": torch.bfloat16,
    "LongStorage": torch.int64,
    "IntStorage": torch.int32,
    "ShortStorage": torch.int16,
    "CharStorage": torch.int8,
    "ByteStorage": torch.uint8,
    "BoolStorage": torch.bool,
    "UntypedStorage": torch.uint8,
}
_PROTOCOL = 1001
"""What torch writes behind the magic number of a checkpoint that is no zip."""

_BIG_ENDIAN = "was written on a big-endian machine; save it again on a little-endian one"

Blocks = Callable[[str, torch.dtype, int], Tensor]
"""(key, type, number of items) → the flat tensor that a file holds under this key."""


class Foreign:
    """Stands for an object of a class that was not loaded. `state` is what the pickle wanted to set on it."""

    def __init__(self, *arguments: object, **named: object) -> None:
        self.arguments = arguments
        self.state: object = named

    def __setstate__(self, state: object) -> None:
        self.state = state

    def __setitem__(self, key: object, value: object) -> None:
        """Items of a foreign mapping are dropped."""

    def append(self, item: object) -> None:
        """Items of a foreign list are dropped."""

    def extend(self, items: object) -> None:
        """Items of a foreign list are dropped."""

    def __call__(self, *_: object, **__: object) -> Foreign:
        return self


class _Known:
    """A function that a pickle may call. It has no attributes that the pickle could set."""

    __slots__ = ("_call",)
    _call: Callable[..., Any]

    def __init__(self, call: Callable[..., Any]) -> None:
        object.__setattr__(self, "_call", call)

    def __call__(self, *arguments: Any) -> Any:
        return self._call(*arguments)

    def __setattr__(self, name: str, value: object) -> NoReturn:
        raise pickle.UnpicklingError(f"the file sets {name} on a function")

    def __setstate__(self, state: object) -> NoReturn:
        raise pickle.UnpicklingError("the file sets the state of a function")


class _ItemType(_Known):
    """A storage class of torch, of which nothing but the type of its items is wanted."""

    __slots__ = ()

    def __init__(self, item_type: torch.dtype) -> None:
        super().__init__(lambda *_: item_type)


class _RestrictedUnpickler(pickle.Unpickler):
    def __init__(self, file: io.BufferedIOBase, blocks: Blocks) -> None:
        super().__init__(file, encoding="utf-8")
        self._blocks = blocks

    def find_class(self, module: str, name: str) -> Any:
        match module, name:
            case "collections", "OrderedDict":
                return OrderedDict
            case "torch", "Size":
                return _Known(lambda sizes=(): tuple(sizes))
            case "torch._utils", "_rebuild_tensor_v2":
                return _Known(_rebuilt)
            case "torch._utils", "_rebuild_parameter" | "_rebuild_parameter_with_state":
                return _Known(lambda data, *_: data)
            case "torch._tensor", "_rebuild_from_type_v2":
                return _Known(_rebuilt_of_type)
            case "torch" | "torch.storage", storage if storage in _ITEM_TYPES:
                return _ItemType(_ITEM_TYPES[storage])
            case _:
                return type(name.rpartition(".")[2] or "Nameless", (Foreign,), {})

    def persistent_load(self, pid: Any) -> Tensor:
        match pid:
            case ("storage", _ItemType() as item_type, str(key), _, int(count), *rest) if rest in ([], [None]):
                return self._blocks(key, item_type(), count)
            case _:
                raise pickle.UnpicklingError(
                    "it holds storages in a form that is not supported (views or foreign types)"
                )


def read_checkpoint(path: Path) -> dict[str, Any]:
    """What a checkpoint holds, as a dict; raises `WeightsError` for a file that is none, and says what it is."""
    if not path.exists():
        raise WeightsError(f"{path}: no such file")
    container, what = container_of(path)
    if container is Container.OTHER:
        raise WeightsError(f"{path.name}: {what}")
    try:
        content = _read_zip(path) if container is Container.ZIP else _read_pickles(path)
    except WeightsError:
        raise
    except Exception as error:  # a damaged pickle fails in any way
        reason = (str(error).splitlines() or [type(error).__name__])[0][:200]
        raise WeightsError(f"{path.name}: not a torch checkpoint that can be read ({reason})") from None
    if not isinstance(content, dict):
        raise WeightsError(f"{path.name}: holds a {type(content).__name__}, wanted a dict with a `state_dict`")
    return content


def state_dict_of(content: Mapping[str, Any], name: str) -> dict[str, Tensor]:
    """The state dict in a checkpoint: under `state_dict`, or the checkpoint itself."""
    state = content.get("state_dict", content)
    items = state.items() if isinstance(state, Mapping) else ()
    tensors = {key: value.detach() for key, value in items if isinstance(value, Tensor) and isinstance(key, str)}
    if not tensors:
        raise WeightsError(f"{name}: no tensors under `state_dict`; keys are {', '.join(map(str, content))[:200]}")
    return tensors


def _read_zip(path: Path) -> Any:
    with zipfile.ZipFile(path) as archive:
        found = next(name for name in archive.namelist() if name.endswith("data.pkl"))
        folder = found.removesuffix("data.pkl")

        def block(key: str, item_type: torch.dtype, count: int) -> Tensor:
            entry = archive.getinfo(f"{folder}data/{key}")
            return _items(_stored(archive, entry, path), item_type, count)

        order = next((name for name in archive.namelist() if name == f"{folder}byteorder"), None)
        if order is not None and _stored(archive, archive.getinfo(order), path) != b"little":
            raise WeightsError(
                f"{path.name}: was written on a big-endian machine; save it again on a little-endian one"
            )
        pickled = _stored(archive, archive.getinfo(found), path)
        return _RestrictedUnpickler(io.BytesIO(pickled), block).load()


def _stored(archive: zipfile.ZipFile, entry: zipfile.ZipInfo, path: Path) -> bytes:
    """The bytes of an entry; torch compresses nothing, so what is compressed may unpack to anything."""
    if entry.compress_type != zipfile.ZIP_STORED or entry.file_size > path.stat().st_size:
        raise WeightsError(f"{path.name}: its entry {entry.filename[:60]} is compressed, which torch never does")
    return archive.read(entry)


def _read_pickles(path: Path) -> Any:
    """A checkpoint of torch < 1.6: magic number, protocol, machine, object and keys as pickles, then raw storages.

    The object comes before the storages it is made of, so it is read twice: first to find them.
    """
    with open(path, "rb") as file:
        _plain(file)  # the magic number, by which the container was told
        if _plain(file) != _PROTOCOL:
            raise pickle.UnpicklingError(f"its protocol is not {_PROTOCOL}")
        machine = _plain(file)
        if not (isinstance(machine, dict) and machine.get("little_endian", True) is True):
            raise WeightsError(
                f"{path.name}: was written on a big-endian machine; save it again on a little-endian one"
            )
        start, wanted = file.tell(), {}

        def note(key: str, item_type: torch.dtype, count: int) -> Tensor:
            wanted[key] = (item_type, count)
            return torch.empty(0, dtype=item_type)

        _RestrictedUnpickler(file, note).load()
        blocks = {}
        for key in _plain(file):
            item_type, count = wanted[key]
            declared = int.from_bytes(file.read(8), "little", signed=True)
            size = count * item_type.itemsize
            if declared != count or not 0 <= size <= path.stat().st_size:
                raise pickle.UnpicklingError(f"storage {str(key)[:40]} has {declared} items, the object says {count}")
            blocks[key] = _items(file.read(size), item_type, count)
        file.seek(start)
        return _RestrictedUnpickler(file, lambda key, item_type, count: blocks[key]).load()


def _plain(file: io.BufferedIOBase) -> Any:
    def none(key: str, item_type: torch.dtype, count: int) -> Tensor:
        raise pickle.UnpicklingError("a storage where none belongs")

    return _RestrictedUnpickler(file, none).load()


def _items(raw: bytes, item_type: torch.dtype, count: int) -> Tensor:
    size = count * item_type.itemsize
    if not 0 <= size <= len(raw):
        raise pickle.UnpicklingError(f"a storage of {count} items has {len(raw)} bytes")
    if count == 0:
        return torch.empty(0, dtype=item_type)
    return torch.frombuffer(bytearray(raw[:size]), dtype=item_type)


def _rebuilt(block: Tensor, offset: int, size: tuple[int, ...], stride: tuple[int, ...], *_: object) -> Tensor:
    if not len(block):  # the first reading of a checkpoint whose storages come later
        return block
    last = offset + sum((length - 1) * step for length, step in zip(size, stride, strict=True))
    is_empty = 0 in size
    if min((offset, *size, *stride)) < 0 or math.prod(size) > len(block) or (last >= len(block) and not is_empty):
        raise pickle.UnpicklingError(f"a tensor of {tuple(size)} lies outside its storage of {len(block)} items")
    return torch.as_strided(block, size, stride, offset)


def _rebuilt_of_type(call: object, kind: object, arguments: tuple[Any, ...], *_: object) -> Any:
    return call(*arguments) if isinstance(call, _Known) else Foreign(*arguments)
