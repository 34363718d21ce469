"""One kind of fault a file, all with the interface of `judgement`."""
