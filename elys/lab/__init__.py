"""Experiments over simulations: speed against error, calibration, sweeps, hard cases, peers."""
