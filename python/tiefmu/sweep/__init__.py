"""Many runs of a scene's variants, on one machine or a cluster: docs/sweep.md."""
