"""The native engine of the proxies, in C (:mod:`fmus.rig_proxy.proxy` lists the files)."""
