"""Ties to look at: VTK files for ParaView, and one page to sign off."""
