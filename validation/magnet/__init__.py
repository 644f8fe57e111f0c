"""Design of the Hall sensor's magnet: two-dimensional magnetostatics, nonlinearity, contour optimisation."""
