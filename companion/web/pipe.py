"""How the flying process and the display's talk: moments one way, lines of JSON the other.

A moment is its length in four bytes, then a pickle. Nobody but the parent can write into that pipe.
"""

import asyncio
import pickle
from typing import Any

_LENGTH_BYTES = 4
_LONGEST_BYTES = 16_000_000


def packed(thing: Any) -> bytes:
    """The bytes that carry it."""
    body = pickle.dumps(thing, protocol=pickle.HIGHEST_PROTOCOL)
    return len(body).to_bytes(_LENGTH_BYTES, "big") + body


async def unpacked(reader: asyncio.StreamReader) -> Any:
    """The next thing out of the pipe; `EOFError` when the other end is gone."""
    try:
        length = int.from_bytes(await reader.readexactly(_LENGTH_BYTES), "big")
        if length > _LONGEST_BYTES:
            raise EOFError
        return pickle.loads(await reader.readexactly(length))
    except asyncio.IncompleteReadError as end:
        raise EOFError from end
