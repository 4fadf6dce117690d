"""The paper's controllers as it prints them."""
