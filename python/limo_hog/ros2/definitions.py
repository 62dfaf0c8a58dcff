"""Message definitions that rosbags does not bring along; `definitions.msg` holds them as recordings do."""

from __future__ import annotations

from pathlib import Path

from rosbags.typesys import get_types_from_msg
from rosbags.typesys.store import Typestore


def add_to(store: Typestore) -> None:
    """Add the definitions to rosbags' own."""
    text = Path(__file__).with_name("definitions.msg").read_text(encoding="utf-8")
    _, *definitions = text.split(f"{'=' * 80}\nMSG: ")
    for definition in definitions:
        name, _, fields = definition.partition("\n")
        store.register(get_types_from_msg(fields, name.replace("/", "/msg/")))
