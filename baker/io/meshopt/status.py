"""Results of the meshopt kernels."""

from __future__ import annotations

# Return values of the kernels, and the ends of the sentences that describe them.
DONE, TOO_SHORT, TOO_LONG, BAD_CODE = 0, 1, 2, 3
REASONS = {
    TOO_SHORT: "the compressed data is cut off",
    TOO_LONG: "the compressed data has bytes left over",
    BAD_CODE: "the compressed data has an unknown code",
}
