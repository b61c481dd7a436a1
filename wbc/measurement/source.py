"""Where a log came from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True)
class LogSource:
    """Provenance of a log: enough to find it again and to know what was done on the way in.

    Attributes:
        path: the file, empty for a log made in memory.
        sha256: digest of the whole file, empty for a log made in memory.
        part: which log of the file, when it holds several.
        mapping: path of the column map that was used, empty for none.
        decimation: every how many rows one was kept (after the anti-alias filter); 1 is all.
        ignored: columns of the file that were not read because no name of the schema fits them.
        notes: what else was changed while reading (rows dropped, columns left out).
        unusable: channels that were left out because they hold NaN -> where, and the way out.
        trusted: whether the user vouches for the columns, so that suspicions only warn.
    """

    path: str = ""
    sha256: str = ""
    part: str = ""
    mapping: str = ""
    decimation: int = 1
    ignored: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    unusable: Mapping[str, str] = field(default_factory=dict)
    trusted: bool = False

    @property
    def label(self) -> str:
        """How messages call the log: its path, and the part of the file if there are several."""
        path = self.path or "log in memory"
        return f"{path}#{self.part}" if self.part else path
