"""Former place of the plain plant's parameters, kept until every importer uses hand_model.kernel.plant_rows."""

from hand_model.kernel.plant_rows import DEGREE, PLANT_PARAMETERS, PLANT_ROW, STEP_S, Parameter

__all__ = ["DEGREE", "PLANT_PARAMETERS", "PLANT_ROW", "STEP_S", "Parameter"]
