"""Speed and quality, measured as ratios against a reference in one run."""
