"""Real machines: recordings that others published, diagnosed, predicted, and compared with rivals."""
