"""Proofs that a robot does not need: the blind trial, the figures of the paper, the design of the magnet, benches."""
