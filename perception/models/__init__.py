"""Networks to choose from: their cards, how they compare, and which one perception uses."""
