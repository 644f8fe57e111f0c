"""What proves the rest and no robot needs: the blind trial, the paper's figures, the magnet's design, benches."""
