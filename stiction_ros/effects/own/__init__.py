"""Effects of one's own: files in this folder, and in those that STICTION_EFFECTS lists."""

import os

__path__ += [
    folder for folder in os.environ.get("STICTION_EFFECTS", "").split(os.pathsep) if folder
]
