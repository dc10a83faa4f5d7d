"""Files that visitors hand over: one room for each visitor, and what all of them may have here together."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from threading import RLock

from app.catalogue.entries import Entry
from app.catalogue.visitor_uploads import MEGABYTE, UploadError, UploadLimits, VisitorUploads
from etnet.files import in_megabytes
from etnet.private_folder import PrivateFolder

SPARE_DISK = 256 * MEGABYTE
"""Bytes of the disk that are left free whatever comes."""


class Uploads:
    """All that visitors have handed over to this server. Safe from every thread."""

    def __init__(self, limits: UploadLimits, take_in: Callable[[Entry], None], let_go: Callable[[str], None]) -> None:
        """`take_in` makes a file one that can be opened; `let_go` forgets it, with all that was computed of it."""
        self.limits = limits
        self.take_in, self.let_go = take_in, let_go
        self.lock = RLock()
        self._folder: PrivateFolder | None = None
        self._desks: dict[str, VisitorUploads] = {}
        self._is_closed = False

    def desk(self) -> VisitorUploads:
        """Room for one more visitor."""
        desk = VisitorUploads(self)
        with self.lock:
            self._desks[desk.ticket] = desk
        return desk

    def desk_of(self, ticket: str) -> VisitorUploads:
        """The desk that a page's ticket is for."""
        with self.lock:
            desk = self._desks.get(ticket)
        if desk is None:
            raise UploadError("the page that sends this file is not open any more; load it again")
        return desk

    def room(self, desk: VisitorUploads, size: int) -> Path:
        """The visitor's folder, if `size` bytes more fit here at all; called under the lock."""
        if self._is_closed:
            raise UploadError("the viewer is being stopped")
        found = self._found() or PrivateFolder("etnet-uploads-")
        self._folder = found
        held = sum(each.num_bytes for each in self._desks.values())
        awaited = sum(each.awaited_bytes for each in self._desks.values())
        left = min(self.limits.total_bytes - held, _free(found) - awaited)
        if size > left:
            raise UploadError(
                f"{in_megabytes(size)} do not fit: all visitors together have {in_megabytes(max(left, 0))} left here; "
                "try again later, or start the viewer with --data FOLDER"
            )
        folder = found.path / desk.folder_name
        folder.mkdir(exist_ok=True)
        return folder

    def _found(self) -> PrivateFolder | None:
        """Where files lie, if anywhere: some systems remove what nobody has touched for days among temporary files."""
        if self._folder is not None and not self._folder.path.is_dir():
            self._folder.close()
            self._folder = None
        return self._folder

    def left_unpacked(self) -> int:
        """Bytes that are left to all visitors for what is made of files; below 0 where it has more."""
        with self.lock:
            desks, folder = tuple(self._desks.values()), self._found()
        most = int(self.limits.growth * self.limits.total_bytes)
        left = most - sum(desk.unpacked_bytes for desk in desks)
        return left if folder is None else min(left, _free(folder))

    def leave(self, desk: VisitorUploads) -> None:
        """Forget a visitor with all their files."""
        with self.lock:
            self._desks.pop(desk.ticket, None)
            folder = None if self._folder is None else self._folder.path / desk.folder_name
        if folder is not None:
            shutil.rmtree(folder, ignore_errors=True)

    def close(self) -> None:
        """Remove everything; nothing more is taken."""
        with self.lock:
            self._is_closed = True
            desks, self._desks = list(self._desks.values()), {}
            folder, self._folder = self._folder, None
        for desk in desks:
            desk.close()
        if folder is not None:
            folder.close()


def _free(folder: PrivateFolder) -> int:
    return shutil.disk_usage(folder.path).free - SPARE_DISK
