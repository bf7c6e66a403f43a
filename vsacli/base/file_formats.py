"""Formats of files: values of the key `format` of YAML files, and of the attribute `format` of HDF5 files.

The number after the slash is the version. Files of a newer version are refused.
"""

ROBOT = "vsacli-robot/1"
TRAJECTORY = "vsacli-trajectory/1"
POLES = "vsacli-poles/1"
STUDY = "vsacli-study/1"
COLUMNS = "vsacli-columns/1"

RESULT = "vsacli-result/2"
SIMULATION = "vsacli-simulation/2"
SENSITIVITY = "vsacli-sensitivity/2"
TREE_FORMATS = {
    RESULT: "vsacli-result/3",
    SIMULATION: "vsacli-simulation/3",
    SENSITIVITY: "vsacli-sensitivity/3",
}
"""Versions for robots that are trees or have `tools`: a dimension `tool`, and inputs `parent`, `mount` and
`tools`, which readers of the version before would miss."""

STUDY_TABLE = "vsacli-study-table/1"
