"""gyriflow: from fetal brain MRI to cortical-folding metrics."""

__version__ = "0.1.0"
