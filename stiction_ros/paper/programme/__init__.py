"""The paper's nonlinear programme (12)."""
