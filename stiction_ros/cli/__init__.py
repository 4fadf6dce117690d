"""The command ``stiction``, thin over functions of the other floors."""
