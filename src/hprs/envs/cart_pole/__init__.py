"""The language's first example: a cart that balances a pole and parks on a mark."""
