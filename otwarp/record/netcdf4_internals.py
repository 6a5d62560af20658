"""What reaches into netCDF4: everything of the recording that counts on more than the library promises stands here.

Seen in netCDF4 1.6 to 1.7; `tests/record/test_netcdf4_internals.py` fails when what is used here is not there any more.

- *A file that may not be closed.* After a failed write (a full disk) the library crashes the interpreter when it closes
  the file, as it also would when the object is collected. `Dataset._isopen`, 0 in a closed one, keeps it from both.
"""

from __future__ import annotations

from typing import Any


def abandon(file: Any) -> None:
    """Mark a `netCDF4.Dataset` as closed without closing it: neither `close` nor its end touches the file any more."""
    import netCDF4

    netCDF4.Dataset._isopen.__set__(file, 0)  # type: ignore[attr-defined]
