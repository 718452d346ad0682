"""Tests of ``switched``: controls that take only listed values."""
