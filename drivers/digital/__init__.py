"""What drivers of digital sensors share: settings, records, counts of samples, frames, and the base of their twins."""
