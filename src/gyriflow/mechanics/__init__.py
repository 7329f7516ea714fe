"""The mechanics of growing tissue as UFL expressions: symbols as in the paper."""
