"""What everything stands on: errors, checks at the door, units, printed tables, records."""
