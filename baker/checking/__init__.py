"""Judges scenes before they are baked: findings, their limits, reports for people and for builds."""

from baker.checking.check import CheckReport, check_scene
from baker.checking.report import report_json
from baker.checking.settings import CheckSettings, make_check_settings

__all__ = ["CheckReport", "CheckSettings", "check_scene", "make_check_settings", "report_json"]
