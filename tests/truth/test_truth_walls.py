"""A closed room beside a bright outside: no light gets in, wherever walls, ceiling, beams and shelves meet texels."""

from __future__ import annotations

import numpy as np
import pytest
from scenes import GAP, SceneBuilder

from baker.core.lightmap import TexelStatus
