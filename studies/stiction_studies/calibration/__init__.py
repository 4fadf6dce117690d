"""The probability of friction, fitted to simulated loops and checked on others."""
