(function name: (identifier) @name) @definition.function
(function_block name: (identifier) @name) @definition.class
(program name: (identifier) @name) @definition.class
(class name: (identifier) @name) @definition.class
(interface name: (identifier) @name) @definition.interface
(method name: (identifier) @name) @definition.method
(action name: (identifier) @name) @definition.method
(property name: (identifier) @name) @definition.method
(single_accessor name: (identifier) @name) @definition.method
(type_declaration name: (identifier) @name) @definition.type
(namespace name: (named_type) @name) @definition.module
(test name: (string) @name) @definition.test

(call_expression function: (identifier) @name) @reference.call
(call_expression function: (member_expression member: (identifier) @name)) @reference.call
(extends (named_type) @name) @reference.class
(implements (named_type) @name) @reference.implementation
(variable_declaration type: (named_type) @name) @reference.type
