"""Where a recording and the model differ: located, named, modelled, shown."""
