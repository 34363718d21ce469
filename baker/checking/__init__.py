"""Judges scenes before they are baked: findings, their limits, reports for people and for builds."""

from baker.checking.check import CheckReport, CheckSettings, check_scene
from baker.checking.report import report_json

__all__ = ["CheckReport", "CheckSettings", "check_scene", "report_json"]
