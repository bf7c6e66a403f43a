"""Sizing of drives and springs: the demands of motions, and the motors and gears that meet them."""

from vsacli.studies.sizing.catalog import CatalogMotor
from vsacli.studies.sizing.choices import CRITERIA
from vsacli.studies.sizing.motor_sizing import MotorSizing
from vsacli.studies.sizing.sizing import size_drives, sized_text
from vsacli.studies.sizing.sizing_report import Sizing

__all__ = ["CRITERIA", "CatalogMotor", "MotorSizing", "Sizing", "size_drives", "sized_text"]
