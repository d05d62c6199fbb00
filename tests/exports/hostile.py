"""A robot over stdin and stdout whose texts and numbers are hard to export."""

import json
import sys

TEXTS = [
    'a, "quoted" text',
    "two\nlines\r\nor three",
    "=1+1",
    "NA",
    "null",
    "true",
    "007",
    "",
    " blanks ",
    "tab\tbell\x07 escape\x1b[31m delete\x7f",
    "nul\x00 in the middle",
    "Büchse №1 “quoted” 🤖 \u2028 \u202e",
    "back\\slash; semi|pipe",
    "'single'",
]
NUMBERS = [
    0.1 + 0.2,
    5e-324,
    1.7976931348623157e308,
    -0.0,
    1 / 3,
    1e-7,
    1e16,
    9007199254740993.0,
    -123456789.12345679,
    7,
]


def answer(tick: int) -> None:
    text = TEXTS[tick % len(TEXTS)]
    lines = [{"type": "log", "text": text}]
    for shift in range(3):
        lines.append({"type": "command", "to": "Vonda", "command": TEXTS[(tick + shift) % len(TEXTS)]})
    lines.append(
        {
            "type": "done",
            "speed_mps": NUMBERS[tick % 2],
            "emotion_state": text,
            "behavior_state": "behaves " + text,
            "state_variables": {
                "number, of a \"kind\"": NUMBERS[tick % len(NUMBERS)],
                "text": text,
                "flag": tick % 2 == 0,
            },
        }
    )
    for line in lines:
        print(json.dumps(line), flush=True)


for received in sys.stdin:
    message = json.loads(received)
    if message["type"] == "end":
        break
    # An incarnation that takes over answers the tick that follows.
    if message["type"] == "tick" or message["tick"] == 0:
        answer(message["tick"])
