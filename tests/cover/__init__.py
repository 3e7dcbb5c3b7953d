"""Coverage of the tests: branches that they take, mistakes that they notice."""
