def write_page(out): pass
