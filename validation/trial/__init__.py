"""The blind trial: an independent plant, concealed effects, sealed truth, scores. Shares no code with the model."""
