"""The paper's controllers as it prints them, by CasADi and IPOPT, and their weights."""
