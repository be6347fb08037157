"""One rule text at array speed: a loaded program becomes an intermediate form, and that becomes code."""
