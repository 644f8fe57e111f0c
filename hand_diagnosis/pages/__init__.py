"""Reports for readers: the page of a diagnosis, of a prediction, of a comparison and of many recordings."""
