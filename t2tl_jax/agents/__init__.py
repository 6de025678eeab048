"""Learners: one readable file each, all behind the interface of `agent.py`."""
