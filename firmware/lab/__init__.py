"""Stations and drivers tried out: started as children or for a moment, watched, counted, ended."""
