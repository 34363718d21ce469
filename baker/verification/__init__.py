"""Judges a finished bake against the path tracer."""

from baker.verification.settings import VerifySettings
from baker.verification.summary import verification_json
from baker.verification.verify import Verification, verify

__all__ = ["Verification", "VerifySettings", "verification_json", "verify"]
