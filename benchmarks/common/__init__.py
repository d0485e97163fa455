"""What several benchmarks share: worlds, intervals, documents and plots."""
