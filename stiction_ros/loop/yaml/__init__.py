"""Loop models as YAML: checked reading, each error with its key."""
