"""The catalogue of diagnostic codes: what each one means.

Codes are stable. `ENV` concerns text files, `GEO` meshes, `KIN` bodies and connections, `MJC` what is written for
MuJoCo, `CFG` configurations and queries.
"""

from __future__ import annotations

CATALOGUE: dict[str, str] = {
    # Text files: 1xx encoding and syntax, 2xx words and counts, 3xx things read but not used.
    # Meshes.
    # Bodies and connections.
    # What is written for MuJoCo.
    # Configurations and queries.
}
