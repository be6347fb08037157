"""Evidence about rule programs: tables of scenes with expected answers, coverage, and mutation."""
