"""Self-contained HTML pages: one template environment, one base page, figures embedded as PNG."""
