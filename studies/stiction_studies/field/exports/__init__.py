"""A plant of loops of the field, exported as historians do, with everything wrong."""

from stiction_studies.field.exports.plant import export_plant

__all__ = ["export_plant"]
