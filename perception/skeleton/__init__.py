"""From cane pixels to rooted canes: fragments, linking, centre lines, topology."""
