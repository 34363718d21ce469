"""What a bake is judged by: one file for each kind of fault, all with the interface of `judgement`."""
