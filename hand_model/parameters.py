"""Former place of the row table, kept until every importer uses hand_model.kernel.rows."""

from hand_model.kernel.rows import DEGREE, JOINT_PARAMETERS, ROW, STEP_S, Parameter, markdown_table

__all__ = ["DEGREE", "JOINT_PARAMETERS", "ROW", "STEP_S", "Parameter", "markdown_table"]
