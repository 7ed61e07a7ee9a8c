"""A campaign while it is measured: each record checked, identified and placed as it lands."""
