"""The program `docs/reference/seeding.py`, as a reference that shares no code with taskspec."""

from tests.shared.scripts import script

CODE = vars(script("seeding"))
STEP = CODE["STEP"]
RESET = CODE["RESET"]
CONSTANT = CODE["CONSTANT"]
words = CODE["words"]
