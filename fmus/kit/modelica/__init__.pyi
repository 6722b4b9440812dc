from .names import class_name as class_name
from .package import PACKAGE as PACKAGE
from .package import package_files as package_files
