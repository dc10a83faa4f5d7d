"""Networks: tensors in, tensors out. They know no events, no windows and no files but weights."""
