"""Judges a finished bake against path tracing."""

from baker.verification.summary import verification_json
from baker.verification.verify import Verification, VerifySettings, verify

__all__ = ["Verification", "VerifySettings", "verification_json", "verify"]
