# lxml ships no type information.
from typing import Any

class XMLSyntaxError(Exception):
    msg: str
    position: tuple[int, int]

def __getattr__(name: str) -> Any: ...
