"""A report on one driveline, section by section, as one page and one text."""
